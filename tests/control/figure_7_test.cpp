// Figure 7: the closed loop in the non-Newtonian fluid, with a disturbance.
#include <gtest/gtest.h>
