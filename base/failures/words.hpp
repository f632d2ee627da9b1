// The cause of a failure, in words for a person: for a command's error line, a log, or the answer to a request.
//
// Rheonaut's own exceptions carry such words: std::invalid_argument, std::runtime_error, std::logic_error and
// std::system_error as they are thrown, and what derives from Worded. The text of any other exception is a library's:
// names of templates, places in its source. It is not shown; its cause is said instead. Two texts of libraries are kept
// because they say what a person has to mend: where a text is no JSON, and (server/runtime/exceptions.hpp) SQLite's,
// in quotes, of a result that has no words here. Functions are safe on every thread.
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
