from nichechain.core.errors import NichechainError
from nichechain.core.text import printable, printable_values


def test_what_a_terminal_would_obey_is_escaped():
    assert printable("\x1b[2J\x07 \u202e") == "\\x1b[2J\\x07 \\u202e"
    assert printable("η* in µm, 90 %\nsecond line") == "η* in µm, 90 %\nsecond line"


def test_every_text_of_a_json_value():
    assert printable_values({"a\x1b": ["\x00", 1, None, {"b": "\r"}]}) == {
        "a\\x1b": ["\\x00", 1, None, {"b": "\\r"}]
    }


def test_an_error_says_nothing_that_a_terminal_obeys():
    assert str(NichechainError("domain is \x1b]0;owned\x07")) == "domain is \\x1b]0;owned\\x07"
