// Writes a discrete controller as source text, for those who run it on a machine of their own.
//
//   state_i ← p_i state_i + r_i e,  duty = direct · e + Σ_i state_i + Σ_j y_j              (1)   (2) of sections.hpp
//   y_j = b0 e + w_j,  w_j ← b1 e - a1 y_j + w'_j,  w'_j ← -a2 y_j                         (2)   of the second order
// Each is a function of the error in m and of a state that begins at 0, called once in every sampling period; it gives
// the duty before any limit. The text says in its head what it is, its period, its errors and what the caller must do.
// Accuracy: the same numbers to the last digit of a double, and (1) in double: 1e-12 of control::SectionFilter, held by
// controller_code_test.cpp, which compiles the C and evaluates the arithmetic of the MATLAB text.
// Errors: none thrown.
#pragma once

#include <string>

#include "control/discretisation/discretise.hpp"

namespace control {

enum class CodeLanguage { c, matlab };
const char* text(CodeLanguage value);

std::string controller_code(CodeLanguage language, const FopdController& controller, const Discretisation& made);

}  // namespace control
