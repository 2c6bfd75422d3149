# C types of paraboloid.py, for where it is compiled.


cdef class Paraboloid:
    cdef double _middle, _height, _curvature, _double, _sense
    cpdef double height(self, double x, double y) except? -1
    cpdef double slope_x(self, double x) except? -1
    cpdef double slope_y(self, double y) except? -1
