/* A picture leads to its file: there it has its own size, and fingers can spread it. */
for (const image of document.querySelectorAll(".bd-article img:not(a img)")) {
  if (image.closest(".sd-card, .only-light, .only-dark, .sphx-glr-thumbcontainer")) continue;
  const link = document.createElement("a");
  link.href = image.src;
  link.className = "picture";
  image.replaceWith(link);
  link.append(image);
  image.decode().then(
    () => link.classList.toggle("wide", image.naturalWidth > 1.4 * image.naturalHeight),
    () => {},
  );
}

// A table, chart or picture wider than the page says that it scrolls, also once its box is unfolded.
const tables = new ResizeObserver((boxes) => {
  for (const { target } of boxes) {
    const before = target.previousElementSibling;
    const marked = before?.classList.contains("scrolls-sideways");
    const wide = target.scrollWidth > target.clientWidth + 8;
    if (wide && !marked) {
      const line = document.createElement("p");
      line.className = "scrolls-sideways";
      line.textContent = "Scroll sideways \u2192";
      target.before(line);
    } else if (marked && !wide) {
      before.remove();
    }
  }
});
for (const table of document.querySelectorAll(
  ".pst-scrollable-table-container, .chart-frame, a.picture",
)) {
  tables.observe(table);
}
