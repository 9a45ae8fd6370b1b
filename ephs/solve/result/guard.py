"""Untrusted result files: checks before reading, and escaping of names that netCDF cannot represent."""

import re
from pathlib import Path as File
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

MOST = 200
"""Largest ratio of decompressed to stored size: a larger one is an attack on memory."""
_FILTERS = (1, 2, 3)  # of HDF5: deflate, shuffle, fletcher32; others are plug-ins, which are code
_KINDS = "biufSU"


def check_file(file: File) -> None:
    """Look at a netCDF file without reading its arrays.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    ValueError
        It is no HDF5, leads to other files, wants plug-ins, or would take far more memory than its size tells.
    """
    import h5py

    if not file.exists():
        raise FileNotFoundError(f"{file}: no such file")
    if not file.is_file():
        raise ValueError(f"{file}: not a file")
    try:
        with h5py.File(file, "r") as opened:
            found = _faults(opened, MOST * file.stat().st_size)
    except (OSError, RuntimeError, KeyError) as error:
        raise ValueError(f"{file}: not a netCDF file ({error})") from error
    if found:
        raise ValueError(f"{file}: not a solution of this program: {found}")


def _faults(opened: Any, most: int) -> str:
    import h5py

    total = 0
    for name in opened:
        if not isinstance(opened.get(name, getlink=True), h5py.HardLink):
            return f"{name!r} leads elsewhere, expected arrays of the file's own"
        array = opened[name]
        if not isinstance(array, h5py.Dataset):
            return f"{name!r} is no array"
        if array.external or array.is_virtual:
            return f"{name!r} is kept in other files, expected arrays of the file's own"
        made = array.id.get_create_plist()
        if any(made.get_filter(k)[0] not in _FILTERS for k in range(made.get_nfilters())):
            return f"{name!r} wants a plug-in to be read, expected numbers, deflated at most"
        if array.dtype.kind not in _KINDS and h5py.check_string_dtype(array.dtype) is None:
            return f"{name!r} holds {array.dtype}, expected numbers or text"
        total += (array.size or 0) * max(array.dtype.itemsize, 1)
        if total > most:
            return f"its arrays take {total / 1e6:.3g} MB, expected at most {most / 1e6:.3g} MB of a file of this size"
    return ""


def named_for_file(data: "xr.Dataset") -> "xr.Dataset":
    """The data with names that netCDF can hold."""
    return data.rename({name: name_for_file(str(name)) for name in {*data.variables, *data.dims}})


def name_for_file(name: str) -> str:
    """A name that netCDF can hold: in paths, ``/`` is written ``%2F``, and ``%`` is ``%25``."""
    return name.replace("%", "%25").replace("/", "%2F")


def name_from_file(name: str) -> str:
    """The name that `name_for_file` changed."""
    letters = {"%25": "%", "%2F": "/"}
    return re.sub("%25|%2F", lambda each: letters[each[0]], name)
