from nichechain.core.errors import NichechainError
from nichechain.core.text import printable, printable_values, rounded


def test_what_a_terminal_would_obey_is_escaped():
    assert printable("\x1b[2J\x07 \u202e") == "\\x1b[2J\\x07 \\u202e"
    assert printable("η* in µm, 90 %\nsecond line") == "η* in µm, 90 %\nsecond line"


def test_every_text_of_a_json_value():
    assert printable_values({"a\x1b": ["\x00", 1, None, {"b": "\r"}]}) == {
        "a\\x1b": ["\\x00", 1, None, {"b": "\\r"}]
    }


def test_an_error_says_nothing_that_a_terminal_obeys():
    assert str(NichechainError("domain is \x1b]0;owned\x07")) == "domain is \\x1b]0;owned\\x07"


def test_large_numbers_are_rounded_without_a_power_of_ten():
    assert [rounded(x) for x in (8123.4, 162_755, -999.9, 75.04, 0.1234, 9.29e9)] == [
        *("8,120", "163,000", "-1,000", "75", "0.123", "9,290,000,000"),
    ]
