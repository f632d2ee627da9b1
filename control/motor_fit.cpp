// Two parameters, by least squares.
#include "control/motor_fit.hpp"
