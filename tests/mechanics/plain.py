"""Steps as their method has them, without the correction that keeps the balance: what closed forms of steps are for."""

from contextlib import contextmanager

import numpy as np
import pytest

from ephs.mechanics.tree.equations.accounts import Accounts
from ephs.solve.methods.settling import Settling

__all__ = ["uncorrected"]


@contextmanager
def uncorrected():
    """Runs that begin inside have no energy to meet."""
    reduced, general = Accounts.opened, Settling.opened

    def without(self, state):
        state = reduced(self, state)
        state.account[0] = np.nan
        return state

    def plain(self, x):
        account = general(self, x)
        account[0] = np.nan
        return account

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Accounts, "opened", without)
        patch.setattr(Settling, "opened", plain)
        yield
