# C types of block_tracking.py.
cimport cython
from robot_formation.vision.pixy2.boxes cimport Box

cdef int _TICK_MASK, _OLDEST, _INDICES, _NOBODY, _LEADING, _VALID, _TRAILING

cdef class BoxTrack:
    cdef public Box box
    cdef public int index, stamp, state, age

cdef class Tracker:
    cdef object _gate, _origin_us, _last_us
    cdef long long _lead, _trail
    cdef int _next_index
    cdef list _tracks

    @cython.locals(
        now=int, number=Py_ssize_t, owner=Py_ssize_t, owners=list, owned=list, tracks=list, track=BoxTrack,
    )
    cpdef step(self, list boxes, time_us)

    @cython.locals(blocks=list, track=BoxTrack, box=Box, signature=object)
    cpdef list answer(self, sigmap, max_blocks)

    @cython.locals(
        owners=list, costs=list, searching=list, assigned=bint, number=Py_ssize_t, choice=Py_ssize_t,
        evicted=Py_ssize_t,
    )
    cdef list _assign(self, list boxes, long long limit)

    @cython.locals(
        best=Py_ssize_t, lowest="long long", track=BoxTrack, rival=BoxTrack, box=Py_ssize_t, cost="long long",
        owner=Py_ssize_t, stronger=bint,
    )
    cdef Py_ssize_t _choose(self, Py_ssize_t number, list owners, list costs) except -2

    @cython.locals(
        of_signature=dict, costs=list, number=Py_ssize_t, track=BoxTrack, old=Box, new=Box, near=dict, x="long long",
        y="long long", left="long long", right="long long", top="long long", bottom="long long",
    )
    cdef list _costs(self, list boxes, long long limit)

    @cython.locals(elapsed=int)
    cdef bint _update(self, BoxTrack track, Box box, int now) except -1
