# C types of boxes.py.
cimport cython

cdef class Box:
    cdef public int signature, left, right, top, bottom, angle

@cython.locals(
    signature=int, left=int, right=int, top=int, bottom=int, area=Py_ssize_t, boxes=list,
)
cpdef list filtered(blobs, Py_ssize_t min_area, Py_ssize_t room)

@cython.locals(changed=bint, alive=list, i=Py_ssize_t, j=Py_ssize_t, box=Box, other=Box)
cpdef list merged(list boxes, int distance)

@cython.locals(side=int)
cdef bint _merge(Box box, Box other, int distance) except -1

cdef int _facing(int low, int high, int other_low, int other_high, int distance) except -2

@cython.locals(alive=list, i=Py_ssize_t, j=Py_ssize_t, box=Box, other=Box)
cpdef list without_nested(list boxes)

cdef bint _contains(Box box, Box other) except -1
