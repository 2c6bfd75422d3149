# C types of wheel_motor.py, for where it is compiled.


cdef class Wheel:
    cdef public double x, y, z, side, rolling_radius, gain, angle, speed, bristle, drive, direction
    cdef public int state
    cdef object _p
    cdef bint _pwm
    cdef double _per_inertia, _damping, _friction, _count, _start, _stop_at, _integral, _time
    cdef tuple _profile
    cdef int _settled
    cpdef control(self, double dt)
    cpdef turn(self, double load, double dt)
