// Figure 8: the same controller in both fluids.
#include <gtest/gtest.h>
