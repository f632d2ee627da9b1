// Words of an exception for a person: Rheonaut's own as they are, and of a library's the cause without its text.
#include "base/failures/words.hpp"

#include <gmock/gmock.h>

#include <boost/asio/error.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/system/system_error.hpp>
#include <filesystem>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

namespace base::failures {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct Own : std::runtime_error, Worded {
  using runtime_error::runtime_error;
};
struct Foreign : std::runtime_error {
  using runtime_error::runtime_error;
};

template <class Throws>
std::string said(Throws throws) {
  try {
    throws();
  } catch (const std::exception& error) {
    return words_of(error);
  }
  return "nothing was thrown";
}

TEST(Words, OwnOnesStayAsTheyWereThrown) {
  EXPECT_EQ(words_of(std::runtime_error{"the pump is off"}), "the pump is off");
  EXPECT_EQ(words_of(std::invalid_argument{"gain must be above 0, is -1"}), "gain must be above 0, is -1");
  EXPECT_EQ(words_of(Own{"somebody else has the robot"}), "somebody else has the robot");
}

TEST(Words, AFailedConnectionSaysItsCauseAndNotWhereItWasThrown) {
  const auto of = [](const boost::system::error_code& code) {
    static constexpr boost::source_location kPlace = BOOST_CURRENT_LOCATION;
    return words_of(boost::system::system_error{boost::system::error_code{code, &kPlace}});
  };
  EXPECT_EQ(of(boost::asio::error::connection_refused), "nothing listens there");
  EXPECT_EQ(of(boost::asio::error::eof), "it closed the connection");
  EXPECT_EQ(of(boost::asio::error::connection_reset), "it broke the connection");
  EXPECT_EQ(of(boost::beast::http::error::end_of_stream), "it closed the connection");
  EXPECT_EQ(of(boost::beast::http::error::partial_message), "it closed the connection before all was said");
  const std::string other = of(boost::beast::http::error::bad_version);
  EXPECT_THAT(other, Not(AnyOf(HasSubstr("::"), HasSubstr(".cpp"), HasSubstr("["))));
  EXPECT_FALSE(other.empty());
}

TEST(Words, ALibrarysTextIsNotShown) {
  EXPECT_EQ(said([] { throw std::bad_alloc{}; }), "no memory is left");
  EXPECT_EQ(said([] { (void)std::optional<int>{}.value(); }), "a fault of this program (std::bad_optional_access)");
  EXPECT_THAT(said([] { throw Foreign{"secret"}; }), Not(HasSubstr("secret")));
  EXPECT_EQ(said([] { (void)std::filesystem::file_size("/not/there"); }), "'/not/there': No such file or directory");
  EXPECT_THAT(said([] { (void)nlohmann::json::parse("{"); }),
              ::testing::AllOf(HasSubstr("it is not JSON: "), HasSubstr("line 1, column 2"), Not(HasSubstr("["))));
  EXPECT_EQ(said([] { (void)nlohmann::json::object().at("mode"); }),
            "something that it must say is missing, or of another kind");
}

}  // namespace
}  // namespace base::failures
