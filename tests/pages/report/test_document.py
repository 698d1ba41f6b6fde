"""Documents on paper, in a browser: no table is wider than its page, and no number is broken."""

from pathlib import Path

from browser_pages import opened
from playwright.sync_api import Browser

from airrace.pages.report.document import Chapter, Document, table_part
from airrace.pages.views.tables import Column, Table

LONG = "1:Gate_of_the_harbour_with_a_very_long_name_" + "x" * 60
WIDEST = """() => Math.max(...[...document.querySelectorAll("table")].map(one => one.getBoundingClientRect().right
  - document.body.getBoundingClientRect().right))"""
LINES = """() => [...document.querySelectorAll("td:not(.text)")].map(one => {
  const range = document.createRange();
  range.selectNodeContents(one);
  return range.getClientRects().length;
})"""


def test_tables_stay_on_the_page_and_numbers_in_one_line(chromium: Browser, tmp_path: Path) -> None:
    many = [Column("at"), *(Column("height", "deg", ".2f") for _ in range(16))]
    rows = [[name, *(108.25 for _ in range(16))] for name in ("1:start", LONG)]
    few = [Column("way", "m", ".2f"), Column("leg"), Column("remark")]
    tables = [Table("", many, rows), Table("", few, [[14.25, f"{LONG} -> {LONG}", "no flight was found " * 12]])]
    path = tmp_path / "document.html"
    page = Document("a document", [], [Chapter("Tables", [*map(table_part, tables)])], "run 0").html()
    path.write_text(page.replace("</body>", "<script>0</script></body>").replace("<html", '<html class="ready"'))
    one = opened(chromium, path)
    one.page.emulate_media(media="print")
    assert one.run(WIDEST) < 1.0
    assert set(one.run(LINES)) == {1}
    assert len(one.errors) == 1  # the script, which its policy forbids
    assert "Content Security Policy" in one.errors[0]
