// What went wrong, in words for a person: for a command's error line, a log, or the answer to a request.
//
// Rheonaut's own exceptions carry such words: std::invalid_argument, std::runtime_error and std::logic_error as they
// are thrown, and what derives from Worded. The text of any other exception is a library's: names of templates, places
// in its source, an errno. It is never shown; its cause is said instead. Functions are safe on every thread.
#pragma once

#include <exception>
#include <string>

#include <boost/system/error_code.hpp>

namespace base::failures {

// Beside std::exception: the what() of a class of Rheonaut is words for a person.
class Worded {
 public:
  virtual ~Worded() = default;
};

// Such as "nothing listens there" for a connection that was refused. Never empty.
std::string words_of(const boost::system::error_code& error);
std::string words_of(const std::exception& error);

}  // namespace base::failures
