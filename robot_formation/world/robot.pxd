# C types of robot.py, for where it is compiled.

cimport cython

from robot_formation.world.body_and_traction cimport Body
from robot_formation.world.wheel_motor cimport Wheel


cdef class Robot:
    cdef public object start, name, parameters
    cdef public bint moving, disturbed, awake, timed_out, held
    cdef public Body body
    cdef object _stop_stream, _surface, _first_pose
    cdef long _steps_moving, _steps_resting, _rest_steps, _timeout_steps
    cdef double _rest_speed_square, _rest_rate_square
    cpdef bint finished(self) except -1
    cpdef bint pushed(self) except -1
    @cython.locals(wheel=Wheel)
    cdef bint _rests(self) except -1
    cdef bint _slow(self, double linear, double angular) except -1
