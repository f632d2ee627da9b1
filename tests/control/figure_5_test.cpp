// Figure 5: the response to a duty step of 0.3, and the model identified from it.
#include <gtest/gtest.h>
