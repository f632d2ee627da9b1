// The scheme, term by term.
#include "control/grunwald_letnikov.hpp"
