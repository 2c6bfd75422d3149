# C types of blobs.py.
cimport cython

cdef Py_ssize_t HEIGHT, SIGNATURES, _COLUMNS, _NEVER

# What comes from outside may have any layout; what is made here lies row by row.
@cython.locals(
    count=Py_ssize_t, number=Py_ssize_t, position=Py_ssize_t, segment=Py_ssize_t, top=Py_ssize_t, last=Py_ssize_t, seen=Py_ssize_t,
    rank=Py_ssize_t, signature="const Py_ssize_t[:]", row="const Py_ssize_t[:]", start="const Py_ssize_t[:]",
    end="const Py_ssize_t[:]", order="Py_ssize_t[::1]", root="Py_ssize_t[::1]", area="Py_ssize_t[::1]",
    left="Py_ssize_t[::1]", right="Py_ssize_t[::1]", bottom="Py_ssize_t[::1]", place="Py_ssize_t[::1]",
    stops="Py_ssize_t[::1]", noticed="Py_ssize_t[::1]", mine="Py_ssize_t[::1]", ranked=list, found=dict,
)
cpdef dict connect(segments)

@cython.locals(count=Py_ssize_t, segment=Py_ssize_t, number=Py_ssize_t)
cdef void _sort(const Py_ssize_t[:] signature, Py_ssize_t[::1] order, Py_ssize_t[::1] stops) except *

@cython.locals(
    first=Py_ssize_t, near=Py_ssize_t, stop=Py_ssize_t, begin=Py_ssize_t, current=Py_ssize_t, number=Py_ssize_t,
    segment=Py_ssize_t, other=Py_ssize_t, one=Py_ssize_t, two=Py_ssize_t,
)
cdef void _join(
    Py_ssize_t[::1] mine, const Py_ssize_t[:] row, const Py_ssize_t[:] start, const Py_ssize_t[:] end,
    Py_ssize_t[::1] root,
) except *

cdef Py_ssize_t _find(Py_ssize_t[::1] root, Py_ssize_t segment) except -1

@cython.locals(number=Py_ssize_t, segment=Py_ssize_t, blob=Py_ssize_t)
cdef void _measure(
    Py_ssize_t[::1] mine, const Py_ssize_t[:] row, const Py_ssize_t[:] start, const Py_ssize_t[:] end,
    Py_ssize_t[::1] root, Py_ssize_t[::1] area, Py_ssize_t[::1] left, Py_ssize_t[::1] right, Py_ssize_t[::1] bottom,
    Py_ssize_t[::1] place,
) except *

@cython.locals(row_stop=Py_ssize_t, number=Py_ssize_t, begin=Py_ssize_t, later=Py_ssize_t)
cdef void _notice(Py_ssize_t[::1] mine, const Py_ssize_t[:] row, Py_ssize_t[::1] noticed) except *
