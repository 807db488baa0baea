from vnca.core.errors import FileFormatError, printable


def test_a_message_is_one_printable_line_whatever_a_file_put_into_it() -> None:
    message = str(FileFormatError("größer → x\ny\x1b[2J\udcff\r"))
    assert message == "größer → x y\\x1b[2J\\udcff\\r"


def test_a_message_has_an_end() -> None:
    assert len(printable("a" * 10**6)) < 3000
