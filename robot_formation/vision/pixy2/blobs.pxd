# C types of blobs.py.
cimport cython

cdef Py_ssize_t HEIGHT, SIGNATURES, _COLUMNS, _NEVER

@cython.locals(
    count=Py_ssize_t, number=Py_ssize_t, first=Py_ssize_t, stop=Py_ssize_t, segment=Py_ssize_t, last=Py_ssize_t,
    seen=Py_ssize_t, rank=Py_ssize_t, row="Py_ssize_t[::1]", start="Py_ssize_t[::1]", end="Py_ssize_t[::1]",
    root="Py_ssize_t[::1]", area="Py_ssize_t[::1]", left="Py_ssize_t[::1]", right="Py_ssize_t[::1]",
    bottom="Py_ssize_t[::1]", place="Py_ssize_t[::1]", stops="Py_ssize_t[::1]", noticed="Py_ssize_t[::1]",
    ranked=list, found=dict,
)
cpdef dict connect(segments)

# Segments from outside may have any layout in memory.
@cython.locals(segment=Py_ssize_t, number=Py_ssize_t, place=Py_ssize_t)
cdef void _sort(
    const Py_ssize_t[:] signature, const Py_ssize_t[:] any_row, const Py_ssize_t[:] any_start,
    const Py_ssize_t[:] any_end, Py_ssize_t[::1] row, Py_ssize_t[::1] start, Py_ssize_t[::1] end,
    Py_ssize_t[::1] stops,
) except *

@cython.locals(
    above=Py_ssize_t, row_first=Py_ssize_t, near=Py_ssize_t, current=Py_ssize_t, segment=Py_ssize_t, other=Py_ssize_t,
    one=Py_ssize_t, two=Py_ssize_t,
)
cdef void _join(
    Py_ssize_t first, Py_ssize_t stop, Py_ssize_t[::1] row, Py_ssize_t[::1] start, Py_ssize_t[::1] end,
    Py_ssize_t[::1] root,
) except *

cdef Py_ssize_t _find(Py_ssize_t[::1] root, Py_ssize_t segment) except -1

@cython.locals(segment=Py_ssize_t, blob=Py_ssize_t)
cdef void _measure(
    Py_ssize_t first, Py_ssize_t stop, Py_ssize_t[::1] row, Py_ssize_t[::1] start, Py_ssize_t[::1] end,
    Py_ssize_t[::1] root, Py_ssize_t[::1] area, Py_ssize_t[::1] left, Py_ssize_t[::1] right, Py_ssize_t[::1] bottom,
    Py_ssize_t[::1] place,
) except *

@cython.locals(after=Py_ssize_t, segment=Py_ssize_t, current=Py_ssize_t, later=Py_ssize_t)
cdef void _notice(Py_ssize_t first, Py_ssize_t stop, Py_ssize_t[::1] row, Py_ssize_t[::1] noticed) except *
