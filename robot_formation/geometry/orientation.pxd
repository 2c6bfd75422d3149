# C types of orientation.py, for where it is compiled.

cimport cython

@cython.locals(
    x=double, y=double, z=double, w=double, a=double, b=double, c=double, t_x=double, t_y=double, t_z=double,
)
cpdef tuple rotate(orientation, vector)
