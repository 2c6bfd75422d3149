# C types of corner_projection.py, for where it is compiled.

cimport cython
from libc cimport math


cdef class CornerProjection:
    cdef const double[:, ::1] _corners
    cdef double _lens_y, _lens_z, _focal_length, _centre_x, _centre_y, _least_depth

    @cython.locals(
        number=Py_ssize_t, corner=Py_ssize_t, x=double, y=double, cosine=double, sine=double, mean=double, more=double,
        mixed=double, roll=double, pitch=double, cr=double, sr=double, cp=double, sp=double, a=double, b=double,
        c=double, d=double, ahead=double, beside=double, above=double, scale=double,
    )
    cpdef project(self, const double[:, ::1] states, double[:, :, ::1] pixels)


@cython.locals(
    edge=Py_ssize_t, number=Py_ssize_t, kind=Py_ssize_t, first=Py_ssize_t, second=Py_ssize_t, one=double, other=double,
    left=double, end=double, farther=double, share=double,
)
cpdef read_edges(
    const double[:, :, ::1] pixels,
    const Py_ssize_t[:, ::1] corners,
    const Py_ssize_t[::1] kinds,
    double row_inset_px,
    double[:, ::1] found,
)
