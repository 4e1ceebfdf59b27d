"""The frame of pages: title, command and date above, notes below that a new page keeps, and one command for all."""

import re
import sys
from pathlib import Path

import pytest
import typer

from studies.__main__ import app
from studies.page import MOST_WORDS, NOTES, STAYS, Page, command_line, frame, notes_of, split_tables, steps

DOCS = Path(__file__).parents[2] / "docs"
TEXT = "# Title\n\nFirst figures.\n"


def test_a_page_names_its_command_and_date_below_its_title():
    assert frame(TEXT, "the command", "2026-01-03").splitlines() == [
        "# Title",
        "",
        "Written by `the command` on 2026-01-03; do not edit it by hand but for the notes at its end.",
        "",
        "First figures.",
        "",
        NOTES,
    ]


def test_notes_outlive_a_new_page(tmp_path, capsys):
    page = Page("modes", tmp_path / "docs")
    page.write(TEXT, "first")
    assert notes_of(page.file) == "\n"
    page.file.write_text(page.file.read_text() + "\n## Why\n")
    page.write(TEXT.replace("First", "Other"), "second", "2026-01-03")
    assert page.file.read_text() == frame(TEXT.replace("First", "Other"), "second", "2026-01-03", "\n\n## Why\n")
    assert f"page     {page.file}" in capsys.readouterr().out
    assert page.picture("modes").parent.is_dir()


def test_a_large_table_becomes_a_data_file_with_a_column_for_each_end_of_an_interval(tmp_path):
    rows = "| `a` | **-1.5 [-2, -1]** | b\\|c* |\n" + "| d | 3 | |\n" * (MOST_WORDS // 5)
    table = "| name | x [m] | note |\n| --- | --- | --- |\n" + rows
    text = f"# Title\n\n## The large: one\n\n{table}\nand\n\n{STAYS}\n{table}\n## Small\n\n| a |\n|---|\n| b |\n"
    shown, tables = split_tables("page", text)
    link = f"{len(rows.splitlines())} rows: [the-large.csv](results/tables/page/the-large.csv)."
    assert shown == text.replace(f"{table}\nand", f"{link}\n\nand").replace(f"{STAYS}\n", "")
    head, first, second, *_ = tables["the-large.csv"].splitlines()
    assert (head, first, second) == ("name,x [m],low,high,note", "a,-1.5,-2,-1,b|c*", "d,3,,,")
    page = Page("page", tmp_path)
    page.write(text, "command")
    assert (tmp_path / "results/tables/page/the-large.csv").read_text() == tables["the-large.csv"]
    page.write(TEXT, "command")
    assert not (tmp_path / "results/tables/page").exists()


def test_a_page_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="cannot write to"):
        Page("modes", tmp_path / "file")


def test_the_command_line_is_one_that_a_shell_takes(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["x", "closed-loop", "--out", "a b", "--reuse"])
    assert command_line("--reuse") == "PYTHONPATH=docs python -m studies closed-loop --out 'a b'"


def test_every_step_is_announced_before_it_is_done(capsys):
    with steps(2) as next_step:
        next_step("first")
        next_step("second")
    assert "2 of 2" in capsys.readouterr().err


def test_committed_pages_name_the_command_that_writes_them():
    written = {
        file.stem: found[1]
        for file in DOCS.glob("*.md")
        if (found := re.search(r"^Written by `PYTHONPATH=docs python -m studies (.*)` on", file.read_text(), re.M))
    }
    assert len(written) >= 11
    for name, arguments in written.items():
        assert arguments.split()[0] == name
        command = typer.main.get_command(app).commands[name]
        command.make_context(name, arguments.split()[1:])  # raises for options that there are not
