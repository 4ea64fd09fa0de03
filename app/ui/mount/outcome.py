"""What came of an order, in one sentence and with its role; nothing of Qt."""

from typing import Any

from app.core.solution import NoSolution, Solution
from app.solve.disagreement import Finding
from app.ui.mount.offset import Offset, size_text
from app.ui.mount.words import Sight
from app.workflows.centre_target import Centring
from app.workflows.nudge import Nudged
from app.workflows.nudge_bring import Turn
from app.workflows.sync_mount import SyncDone, SyncOffer

SYNC_FIRST = "Use Sync… first, which shows it in numbers."


def spoken(result: Any, sight: Sight | None) -> tuple[str, str]:
    """The sentence for a result, empty when it needs none, and the role it is shown in."""
    match result:
        case str():
            return result, ""
        case SyncOffer():
            return result.in_words, ""
        case SyncDone():
            return result.sentence, "good" if result.synced else ""
        case NoSolution():
            return f"No solution, {result.reason}: {result.advice}", "wrong"
        case Solution() if sight is not None:
            off = size_text(Offset.between(sight.mount_deg, result.ra_dec_deg).total_deg)
            return f"Solved: the sky is {off} from where the mount says.", ""
        case Centring():
            more = f" {SYNC_FIRST}" if result.sentence.endswith("confirm it.") else ""
            return result.sentence + more, "good" if result.centred else "wrong"
        case Nudged():
            return f"Nudged {result.direction} by {result.by}.", ""
        case Turn():
            return "The star has been brought.", ""
        case (Finding() as finding, _):
            return finding.sentence, "good" if finding.agrees else ""
    return "", ""
