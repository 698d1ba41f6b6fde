"""Pages printed to PDF by a Chromium that is installed."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from airrace.errors import StorageError, UsageError

BROWSERS = (
    *("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"),
    *("chrome", "microsoft-edge", "microsoft-edge-stable", "msedge"),
)
"""The names under which Chromium and its relatives lie on the path."""
PATIENCE = 180.0
"""The time that a browser has to print, s."""


def browser_path() -> str:
    """Return the path of a browser that prints.

    Raises:
        UsageError: there is none.
    """
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        raise UsageError(
            "a PDF is printed by Chromium, which is not found on the path (chromium, google-chrome, msedge): install "
            "it, or write .html and print that from any browser"
        )
    return found


def print_pdf(page: str) -> bytes:
    """Return a page of HTML as PDF.

    Raises:
        UsageError: there is no browser.
        StorageError: it did not print.
    """
    browser = browser_path()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        html, pdf = folder / "page.html", folder / "page.pdf"
        html.write_text(page, encoding="utf-8", errors="replace")
        command = [browser, "--headless", "--disable-gpu", "--no-first-run", f"--user-data-dir={folder / 'profile'}"]
        command += ["--no-pdf-header-footer", f"--print-to-pdf={pdf}", html.as_uri()]
        if getattr(os, "geteuid", lambda: 1)() == 0:
            command.insert(1, "--no-sandbox")  # which root has to do without; the page holds no script
        try:
            ran = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
            said = ran.stderr.decode(errors="replace").strip().splitlines()[-1:]
        except (OSError, subprocess.TimeoutExpired) as error:
            said = [str(error)]
        if not pdf.exists():
            raise StorageError(f"{browser} did not print ({' '.join(said)}); write .html and print that from a browser")
        return pdf.read_bytes()
