// Figure 6: the Bode diagram of the open loop, and what it says of the printed specification.
#include <gtest/gtest.h>
