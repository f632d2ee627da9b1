// Figure 9: the closed loop in water, with a disturbance.
#include <gtest/gtest.h>
