"""Steps as their method has them, without the correction that keeps the balance: what closed forms of steps are for."""

from contextlib import contextmanager

import numpy as np
import pytest

from ephs.mechanics.tree.equations.accounts import Accounts

__all__ = ["uncorrected"]


@contextmanager
def uncorrected():
    """Runs that begin inside have no energy to meet."""
    opened = Accounts.opened

    def without(self, state):
        state = opened(self, state)
        state.account[0] = np.nan
        return state

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Accounts, "opened", without)
        yield
