"""Pages printed to PDF by a Chromium that is installed."""

import subprocess
import tempfile
from pathlib import Path

from airrace.errors import StorageError
from airrace.report.browser import browser_path, switches

PATIENCE = 180.0
"""The time that a browser has to print, s."""


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
        command = [browser, *switches(folder), "--disable-gpu"]
        command += ["--no-pdf-header-footer", f"--print-to-pdf={pdf}", html.as_uri()]
        try:
            ran = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
            said = ran.stderr.decode(errors="replace").strip().splitlines()[-1:]
        except (OSError, subprocess.TimeoutExpired) as error:
            said = [str(error)]
        if not pdf.exists():
            raise StorageError(f"{browser} did not print ({' '.join(said)}); write .html and print that from a browser")
        return pdf.read_bytes()
