"""Run a page of the gallery and keep it as a notebook with its outputs.

``python tools/notebook.py examples/plot_notebook.py examples/notebook.ipynb`` needs the packages
nbclient, nbformat and ipykernel; tests compare the notebook's code with the page.
"""

import sys
from pathlib import Path


def cells(text: str) -> list[tuple[str, str]]:
    r"""The cells of a page: ``markdown`` or ``code``, and their text.

    Examples
    --------
    >>> cells('"Title"\nx = 1\n\n# %%\n# Words.\ny = 2')
    [('markdown', 'Title'), ('code', 'x = 1'), ('markdown', 'Words.'), ('code', 'y = 2')]
    """
    found: list[tuple[str, str]] = []
    for number, block in enumerate(text.split("\n# %%\n")):
        if number == 0:
            quotes = '"""' if block.startswith('"""') else '"'
            _, words, code = block.split(quotes, 2)
            found.append(("markdown", words.strip()))
        else:
            lines = block.splitlines()
            n_words = next(
                (k for k, line in enumerate(lines) if not line.startswith("#")), len(lines)
            )
            found.append(("markdown", "\n".join(line[2:] for line in lines[:n_words])))
            code = "\n".join(lines[n_words:])
        if code.strip():
            found.append(("code", code.strip()))
    return found


def main(page: Path, notebook: Path) -> None:
    """Write the notebook, run."""
    import nbformat
    from nbclient import NotebookClient

    made = nbformat.v4.new_notebook()
    for kind, text in cells(page.read_text(encoding="utf-8")):
        make = nbformat.v4.new_markdown_cell if kind == "markdown" else nbformat.v4.new_code_cell
        made.cells.append(make(text))
    NotebookClient(made, timeout=600).execute()
    for number, cell in enumerate(made.cells):
        cell["id"] = f"cell-{number}"
        cell.metadata.clear()
    nbformat.write(made, notebook)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
