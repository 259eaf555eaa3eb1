"""Write the repository's address into package metadata: README links and project.urls.

``python tools/address.py https://host/owner/name TAG`` changes README.md and pyproject.toml in
place; the release workflow runs it before it builds (docs/development.md). A checkout has relative
links, which every code host resolves for the branch that is read.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
_LINK = re.compile(r"(!?)\[([^]]*)\]\((?!https?:|#|mailto:)([^)]+)\)")


def with_absolute_links(text: str, address: str, tag: str) -> str:
    """Markdown with links relative to the root made absolute: pages at ``tag``, pictures raw.

    Examples
    --------
    >>> with_absolute_links("[First steps](docs/first_steps.md)", "https://h/o/n", "v1.0.0")
    '[First steps](https://h/o/n/blob/v1.0.0/docs/first_steps.md)'
    >>> with_absolute_links("![map](docs/a.png), [PEP](https://p.org)", "https://h/o/n", "v1")
    '![map](https://h/o/n/raw/v1/docs/a.png), [PEP](https://p.org)'
    """

    def absolute(match: re.Match[str]) -> str:
        picture, words, target = match.groups()
        return f"{picture}[{words}]({address}/{'raw' if picture else 'blob'}/{tag}/{target})"

    return _LINK.sub(absolute, text).replace("git clone ADDRESS", f"git clone {address}")


def urls(address: str) -> str:
    """The table ``[project.urls]`` for a repository's address."""
    return (
        "[project.urls]\n"
        f'Repository = "{address}"\n'
        f'Documentation = "{address}/tree/main/docs"\n'
        f'Changelog = "{address}/blob/main/CHANGELOG.md"\n'
        f'Issues = "{address}/issues"\n'
    )


def main(address: str, tag: str) -> None:
    """Change both files in place."""
    readme, project = ROOT / "README.md", ROOT / "pyproject.toml"
    text = project.read_text(encoding="utf-8")
    if "[project.urls]" in text:
        sys.exit(f"{project.name} has [project.urls] already; run this in a fresh checkout")
    before, table, after = text.partition("[project.scripts]")
    project.write_text(f"{before}{urls(address)}\n{table}{after}", encoding="utf-8")
    readme.write_text(
        with_absolute_links(readme.read_text(encoding="utf-8"), address, tag), encoding="utf-8"
    )


if __name__ == "__main__":
    if len(sys.argv) != 3 or not sys.argv[1].startswith("https://"):
        sys.exit("usage: python tools/address.py https://host/owner/name TAG")
    main(sys.argv[1].rstrip("/"), sys.argv[2])
