"""Work on threads of the engine: whatever goes wrong there becomes one sentence, and never ends the thread unheard."""

from __future__ import annotations

from collections.abc import Callable

from pmviewer.errors import PmviewerError
from pmviewer.progress import Cancelled


def guarded(
    work: Callable[[], None], failed: Callable[[str], None], cancelled: Callable[[], None], memory: str, what: str = ""
) -> None:
    """Do the work. `failed` hears a sentence for the user where it raises anything: `memory` where there is not enough,
    and of an error that nobody expected also `what` it was about. `cancelled` is called where nobody wants its result
    any more."""
    try:
        work()
    except Cancelled:
        cancelled()
    except PmviewerError as error:
        failed(str(error))
    except MemoryError:
        failed(memory)
    except Exception as error:
        failed(what + unexpected(error))


def unexpected(error: Exception) -> str:
    """Text for an error that is pmviewer's own fault."""
    return f"Unexpected {type(error).__name__}: {error}. Please report it together with the scene and the settings."
