// The effective user's name, or number where it has none.
#include "server/cli/accounts/author.hpp"

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>

#include "server/runtime/clock.hpp"

namespace server::cli {

station::Author command_line_author() {
  boost::asio::io_context loop;
  const uid_t uid = ::geteuid();
  const passwd* const user = ::getpwuid(uid);
  const std::string name = user == nullptr ? std::to_string(uid) : user->pw_name;
  return {"cli:" + name, "", runtime::SystemClock{loop}.utc_us()};
}

}  // namespace server::cli
