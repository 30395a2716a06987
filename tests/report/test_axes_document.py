"""Tables about the stress axes in documents."""

from pathlib import Path

from pftrack_sim.report.markdown import update_document
from pftrack_sim.scenario.axes import axes_by_name

DOCUMENT = Path(__file__).parents[2] / "docs/axes.md"


def test_the_document_lists_the_axes_as_they_are(tmp_path: Path):
    copy = tmp_path / "axes.md"
    copy.write_text(DOCUMENT.read_text())
    written, _ = update_document(copy, tmp_path)
    assert written == ["axes"]
    assert copy.read_text() == DOCUMENT.read_text()
    for name, axis in axes_by_name().items():
        assert f"| `{name}` |" in copy.read_text()
        assert axis.law in copy.read_text()
