# C types of world.py, for where it is compiled.

cimport cython

from robot_formation.world.robot cimport Robot


cdef class World:
    cdef object __weakref__
    cdef public object parameters, surface, start_ns
    cdef public long step_count
    cdef object _client, _free, _camera
    cdef dict _robots, _pending, _frames_owed, _sensors, _pictures
    cdef long _frame_steps, _state_steps, _owed_until

    @cython.locals(robot=Robot)
    cdef bint _owes(self) except -1
    cdef list _step(self, bint skip=*)
    @cython.locals(robot=Robot)
    cdef bint _step_physics(self) except -1
    @cython.locals(robot=Robot)
    cdef list _motion_events(self)
