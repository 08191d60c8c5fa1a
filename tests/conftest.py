"""Examples of property tests are the same in every run; `RACCOON_EXPLORE=1` draws fresh ones."""

import os

from hypothesis import settings

settings.register_profile("fixed", derandomize=True)
settings.register_profile("explore", settings.get_profile("default"))
settings.load_profile("explore" if os.environ.get("RACCOON_EXPLORE") else "fixed")
