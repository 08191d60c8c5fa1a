"""Examples of property tests are the same in every run; `RACCOON_EXPLORE=1` draws fresh ones. None has a
deadline: how long one takes says how busy the machine is."""

import os

from hypothesis import settings

settings.register_profile("fixed", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("explore" if os.environ.get("RACCOON_EXPLORE") else "fixed")
