"""Name the repository in what a package index shows: absolute links in README.md, addresses in pyproject.toml.

Usage: absolute_links.py https://HOST/OWNER/NAME TAG

The sources know no host: links within them are relative. A package index resolves none of these, so a release is built
from sources that this script has changed.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def with_absolute_links(text: str, repository: str, tag: str) -> str:
    """Return Markdown whose relative links lead to the files of a tag, pictures to their content."""
    pictures = re.sub(r"(!\[[^\]]*\]\()(?!\w+:|#)", rf"\g<1>{repository}/raw/{tag}/", text)
    return re.sub(r"(?<!!)(\[[^\]]*\]\()(?!\w+:|#)", rf"\g<1>{repository}/blob/{tag}/", pictures)


def addresses(repository: str, tag: str) -> str:
    """Return the table of a project's addresses."""
    named = {
        "Repository": repository,
        "Documentation": f"{repository}/blob/{tag}/docs/index.md",
        "Changelog": f"{repository}/blob/{tag}/CHANGELOG.md",
        "Issues": f"{repository}/issues",
    }
    return "\n[project.urls]\n" + "".join(f'{name} = "{address}"\n' for name, address in named.items())


def main(repository: str, tag: str) -> None:
    """Change both files."""
    readme, project = ROOT / "README.md", ROOT / "pyproject.toml"
    readme.write_text(with_absolute_links(readme.read_text(encoding="utf-8"), repository, tag), encoding="utf-8")
    with project.open("a", encoding="utf-8") as file:
        file.write(addresses(repository, tag))


if __name__ == "__main__":
    main(*sys.argv[1:])
