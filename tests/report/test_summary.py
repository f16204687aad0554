from shipid.report.summary import summary_text


def test_summary_holds_answer_numbers_and_provenance(full_scale):
    text = summary_text(full_scale)
    assert text.startswith("# How much does the cooperative model gain")
    for part in (
        "0.94",
        "2.05",
        "4.30",
        "At the horizon 11.6 m",
        "mean over it 5.01 m, 90th percentile 11.2 m",
        "09f6a2c1d4e5b7a8",
        "| R2 |",
    ):
        assert part in text
    assert "diverged: 4 % of the test windows left the sea" in text
    assert "    shipid study run simulation" in text


def test_names_are_text_and_rows_stay_rows(full_scale):
    text = summary_text(full_scale)
    assert "<script>" not in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    row = next(line for line in tables if "diverged" in line)
    header = next(line for line in tables if line.startswith("| model | A [m] | N_D"))
    assert row.count("|") == header.count("|")
