"""What options of several benchmarks have in common."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection


def comma_separated(allowed: Collection[str]) -> Callable[[str], list[str]]:
    """Reads names that are separated by commas, for `type` of an argparse option: others are refused."""

    def read(text: str) -> list[str]:
        names = [each.strip() for each in text.split(",") if each.strip()]
        strange = [each for each in names if each not in allowed]
        if strange:
            raise argparse.ArgumentTypeError(f"there is no {', '.join(strange)}, only {', '.join(allowed)}")
        return names

    return read
