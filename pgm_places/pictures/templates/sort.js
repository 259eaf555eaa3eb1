// Sort a table by the heading that is selected; selecting it again turns the order round.
// Show the rows whose names contain what is searched for.
(() => {
  const valueOf = (row, column) => row.cells[column].textContent.trim();
  const numberOf = (text) => (text === '–' ? -Infinity : Number(text.replaceAll(',', '')));

  for (const button of document.querySelectorAll('th[aria-sort] button')) {
    button.addEventListener('click', () => {
      const heading = button.closest('th');
      const body = heading.closest('table').tBodies[0];
      const column = heading.cellIndex;
      const rows = [...body.rows];
      const numeric = rows.every((row) => !Number.isNaN(numberOf(valueOf(row, column))));
      // Numbers are wanted from the largest down, names from A on.
      const first = numeric ? 'descending' : 'ascending';
      const second = numeric ? 'ascending' : 'descending';
      const order = heading.getAttribute('aria-sort') === first ? second : first;
      const sign = order === 'ascending' ? 1 : -1;
      const compare = (a, b) => {
        const [one, other] = [valueOf(a, column), valueOf(b, column)];
        return numeric
          ? numberOf(one) - numberOf(other) || 0
          : one.localeCompare(other, undefined, { numeric: true });
      };
      rows.sort((a, b) => sign * compare(a, b));
      for (const other of heading.parentElement.querySelectorAll('[aria-sort]')) {
        other.setAttribute('aria-sort', 'none');
      }
      heading.setAttribute('aria-sort', order);
      body.append(...rows);
    });
  }

  const field = document.querySelector('.search input');
  if (!field) return;
  const rows = [...document.querySelectorAll('table.maps tbody tr')];
  const search = () => {
    const wanted = field.value.trim().toLowerCase();
    let n = 0;
    for (const row of rows) {
      row.hidden = !row.dataset.name.toLowerCase().includes(wanted);
      n += !row.hidden;
    }
    document.querySelector('.search output').textContent =
      wanted && `${n.toLocaleString('en')} of ${rows.length.toLocaleString('en')}`;
  };
  field.addEventListener('input', search);
  for (const link of document.querySelectorAll('a[data-search]')) {
    link.addEventListener('click', () => {
      field.value = link.dataset.search;
      search();
    });
  }
  search(); // browsers keep what was typed when a page is loaded again
})();
