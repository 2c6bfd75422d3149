"""What all tests have in common: the same generated cases in every run, so that a failure is the change's own.

`pytest --hypothesis-profile=default` looks for new cases instead.
"""

from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")
