"""What can be wrong with a bag, on writing and on reading."""

from fastswing_planner.errors import PlannerError


def one_line(text: str) -> str:
    """Return a text as one printable line: a damaged bag's names may hold anything."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


class BagError(PlannerError, OSError):
    """A bag cannot be written or read; the text names the file and what is wrong with it."""

    code_name = "NOT_READY"

    def __str__(self) -> str:
        """Return one line, whatever stands in the bag."""
        return one_line(super().__str__())


class UnreadableBag(BagError):
    """No bag, or one of which nothing can be read."""


class UnknownTopic(BagError):
    """A topic, type or field that the bag does not have."""


class NoHeader(UnknownTopic):
    """A topic whose messages have no stamp."""


class UndecodableMessage(BagError):
    """A message or a definition that does not follow its type."""
