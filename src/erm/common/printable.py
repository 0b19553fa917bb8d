"""Text of files, made safe to print: a terminal obeys control characters, and a new line can look like a message."""

MAX_LETTERS = 1000
"""Letters of one text that are printed; chosen: a long line of a screen, several times."""


def printable(text: str) -> str:
    r"""Write control characters, surrogates and marks of text direction as escapes; cut what is too long.

    Examples
    --------
    >>> printable("RX1\n\x1b[31mall done")
    'RX1\\n\\x1b[31mall done'
    """
    if len(text) > MAX_LETTERS:
        text = f"{text[:MAX_LETTERS]}..."
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
