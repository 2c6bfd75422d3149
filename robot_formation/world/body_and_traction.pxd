# C types of body_and_traction.py, for where it is compiled.

cimport cython
from libc cimport math

from robot_formation.surface.paraboloid cimport Paraboloid
from robot_formation.world.wheel_motor cimport Wheel

cdef double HALF_ROOT
cdef double ROLLER_DRAG_SPEED


cdef class Body:
    cdef public object parameters, index
    cdef public double twist
    cdef public tuple wheels
    cdef public list encoder_angles, encoder_speeds
    cdef Paraboloid _paraboloid
    cdef object _surface, _client, _mass_offset, _law, _pose
    cdef double _dt, _weight
    cdef tuple _v_wheel, _u_wheel

    # What follows from these by arithmetic is typed by inference.
    @cython.locals(
        wheel=Wheel, state=int, dt=double, twist=double, yielding=double, depth=double, load=double, hold=double,
        stiffness=double, damping=double, grip=double, drag=double, sigma0=double, sigma1=double, relaxation=double,
        contact_radius=double, soft=double, travel=double, side=double,
        px=double, py=double, pz=double, qx=double, qy=double, qz=double, qw=double,
        vx=double, vy=double, vz=double, wx=double, wy=double, wz=double,
        slope_x=double, slope_y=double, n_x=double, n_y=double, n_z=double,
        force_x=double, force_y=double, force_z=double, torque_x=double, torque_y=double, torque_z=double,
        e_x=double, e_y=double, e_z=double, per_radius=double, v_rate=double, u_rate=double,
    )
    cpdef apply_ground_forces(self)
    cdef (double, double) _slopes(self, double x, double y) except *
    cdef double _height(self, double x, double y) except? -1
