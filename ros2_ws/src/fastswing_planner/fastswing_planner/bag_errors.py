"""What can be wrong with a bag, on writing and on reading."""

from fastswing_planner.errors import PlannerError


class BagError(PlannerError, OSError):
    """A bag cannot be written or read; the text names the file and what is wrong with it."""

    code_name = "NOT_READY"

    def __str__(self) -> str:
        """Return one line, whatever stands in the bag."""
        text = super().__str__()
        return "".join(letter if letter.isprintable() else " " for letter in text)


class UnreadableBag(BagError):
    """No bag, or one of which nothing can be read."""


class UnknownTopic(BagError):
    """A topic, type or field that the bag does not have."""


class UndecodableMessage(BagError):
    """A message or a definition that does not follow its type."""
