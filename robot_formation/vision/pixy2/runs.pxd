# C types of runs.py.
cimport cython

cdef Py_ssize_t CELLS, HEIGHT, _BRIDGE

@cython.locals(
    count=Py_ssize_t, row=Py_ssize_t, row_start=Py_ssize_t, row_stop=Py_ssize_t, place=Py_ssize_t,
    signature=Py_ssize_t, start=Py_ssize_t, end=Py_ssize_t, run=Py_ssize_t, begin=Py_ssize_t, label=Py_ssize_t,
    stop=Py_ssize_t, pixel=Py_ssize_t, red=int, green=int, blue=int, total=int, column=Py_ssize_t,
    near=bint, weight=double, u=double, v=double,
    low_u=double, high_u=double, low_v=double, high_v=double,
)
cpdef Py_ssize_t find_segments(
    const unsigned char[::1] picture,
    const unsigned char[::1] labels,
    const Py_ssize_t[::1] bounds,
    const double[:, ::1] low,
    const double[:, ::1] high,
    int min_sum,
    Py_ssize_t[:, ::1] found,
) except -1
