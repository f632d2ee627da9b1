// The runs of an experiment with `until`, on fits that the test makes up.
#include "server/experiments/adaptive/until_known.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/experiments/profile_document.hpp"
#include "server/runtime/tasks.hpp"

namespace server::experiments {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kProfile = R"(
name = "n"
purpose = "p"
until = "sigma(alpha) <= 0.02"
most_runs = 4
[limits]
position_max_m = 0.5
position_min_m = -0.5
[[step]]
kind = "prbs"
amplitude = 0.3
bit_s = 0.2
for_s = 20
[[step]]
kind = "duty"
duty = 1
for_s = 20
)";

class UntilKnownTest : public ::testing::Test {
 protected:
  // The fit after the next run says this of alpha.
  void fits_say(std::optional<double> sigma) { sigma_ = sigma; }

  Result<std::optional<Variant>> next() {
    Result<std::optional<Variant>> result;
    auto ask = [](UntilKnownTest& test, Result<std::optional<Variant>>& into) -> boost::asio::awaitable<void> {
      std::function<bool()> is_wanted = [] { return true; };
      std::function<std::string()> actor = [] { return "anna"; };
      into = co_await test.until_.next(test.runs_, std::move(actor), control::kNonNewtonianModel, std::move(is_wanted));
    };
    runtime::run_first(loop_, ask(*this, result));
    if (result && *result) runs_.push_back(static_cast<storage::RunId>(runs_.size()) + 1);
    return result;
  }

  boost::asio::io_context loop_;
  runtime::WorkerThread maths_{"maths"};
  Profile profile_ = parse_profile(kProfile, "test");
  std::optional<double> sigma_;
  double alpha_ = control::kNonNewtonianModel.alpha;
  std::string end_ = "converged";
  std::optional<Error> fails_;
  std::vector<FitRequest> asked_;
  FitOfRuns fit_ = [this](FitRequest request) -> boost::asio::awaitable<Result<FittedModel>> {
    asked_.push_back(request);
    if (fails_) co_return std::unexpected{*fails_};
    FittedModel fitted;
    fitted.job = 7;
    fitted.end = end_;
    fitted.model = control::kNonNewtonianModel;
    fitted.model.alpha = alpha_;
    fitted.one_sigma[3] = sigma_;
    fitted.residual_sd = 0.05;
    co_return fitted;
  };
  std::vector<storage::RunId> runs_;
  UntilKnown until_{profile_, fit_, maths_};
};

TEST_F(UntilKnownTest, EndsWhenEnoughIsKnown) {
  ASSERT_TRUE(next().value());
  EXPECT_TRUE(asked_.empty()) << "there is nothing to fit before the first run";
  fits_say(0.03);
  ASSERT_TRUE(next().value());
  EXPECT_EQ(asked_.back().runs, (std::vector<storage::RunId>{1}));
  EXPECT_TRUE(asked_.back().is_fractional);
  EXPECT_EQ(asked_.back().actor(), "anna");
  EXPECT_NEAR(until_.knowledge().at("promised_sigma").get<double>(), 0.03 / std::sqrt(2), 1e-4);
  fits_say(0.019);
  EXPECT_FALSE(next().value());
  EXPECT_EQ(asked_.back().runs.size(), 2U);
  EXPECT_EQ(until_.conclusion()->reason, "target_reached");
  EXPECT_EQ(until_.conclusion()->detail, "sigma(alpha) is 0.019 after 2 runs, wanted is 0.02");
  EXPECT_EQ(until_.knowledge().at("fit").at("job_id"), 7);
}

TEST_F(UntilKnownTest, SaysThatASigmaAtItsBoundMeansLittle) {
  ASSERT_TRUE(next().value());
  fits_say(0.03);
  ASSERT_TRUE(next().value());
  EXPECT_EQ(until_.knowledge().at("at_bound"), false);
  alpha_ = 2;
  fits_say(0.001);
  EXPECT_FALSE(next().value());
  EXPECT_THAT(until_.conclusion()->detail, HasSubstr("wanted is 0.02; it means little, since alpha lies at its bound"));
  EXPECT_EQ(until_.knowledge().at("at_bound"), true);
}

TEST_F(UntilKnownTest, SaysWhyItCannotBeReached) {
  next();
  fits_say(0.5);
  ASSERT_TRUE(next().value()) << "one run is too little to give up";
  EXPECT_FALSE(next().value());
  EXPECT_EQ(until_.conclusion()->reason, "target_out_of_reach");
  EXPECT_THAT(until_.conclusion()->detail,
              AllOf(HasSubstr("sigma(alpha) is 0.5 after 2 runs"), HasSubstr("even 2 more of every choice"),
                    HasSubstr("would bring it to 0.35 only")));
}

TEST_F(UntilKnownTest, MakesNoMoreRunsThanTheProfileAllows) {
  fits_say(std::nullopt);
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(next().value()) << i;
  EXPECT_FALSE(next().value());
  EXPECT_EQ(until_.conclusion()->reason, "most_runs");
  EXPECT_THAT(until_.conclusion()->detail, HasSubstr("alpha is not determined after 4 runs"));
}

TEST_F(UntilKnownTest, SaysThatTheSearchWasCutOff) {
  end_ = "iteration_limit";
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(next().value()) << i;
  EXPECT_FALSE(next().value());
  EXPECT_THAT(until_.conclusion()->detail,
              HasSubstr("not determined after 4 runs (the search ended by iteration_limit)"));
}

TEST_F(UntilKnownTest, AFitThatFailsIsAnError) {
  next();
  fails_ = Error{ErrorCode::conflict, "the fit, job 3: no", "fit_failed"};
  const auto after = next();
  ASSERT_FALSE(after);
  EXPECT_EQ(after.error().reason, "fit_failed");
}

TEST(FittedModel, IsReadFromTheResultOfAJob) {
  json result = {{"parameters", {{"kp", 2}, {"b1", 0.1}, {"b2", 0.5}, {"b3", 1}, {"alpha", 1.7}, {"beta", 0.6}}},
                 {"one_sigma", {{"kp", 0.1}, {"b1", nullptr}, {"b2", 0.1}, {"alpha", 0.03}, {"beta", 0.01}}},
                 {"end", "converged"},
                 {"residual_sd", 0.04},
                 {"fit_percent", 88},
                 {"warnings", {"one"}},
                 {"channels", {"acceleration_m_s2"}}};
  const auto fitted = fitted_model_from(5, result);
  ASSERT_TRUE(fitted) << fitted.error().detail;
  EXPECT_EQ(fitted->model.alpha, 1.7);
  result["widening"] = 2;
  EXPECT_EQ(fitted_model_from(5, result)->one_sigma[3], 2 * 0.03) << "its doubts are counted";
  result["widening"] = nullptr;
  EXPECT_EQ(fitted_model_from(5, result)->one_sigma[3], std::nullopt) << "nobody knows how much they widen it";
  EXPECT_EQ(fitted->one_sigma[3], 0.03);
  EXPECT_FALSE(fitted->one_sigma[1]);
  EXPECT_TRUE(fitted->is_of_acceleration);
  result["runs"] = {{{"channels", {"position_m"}}}};
  EXPECT_FALSE(fitted_model_from(5, result)->is_of_acceleration) << "of several runs each has its channels";
  result["end"] = "iteration_limit";
  EXPECT_FALSE(fitted_model_from(5, result)->one_sigma[3]) << "of a search that was cut off nothing is known";
  result["residual_sd"] = nullptr;
  EXPECT_EQ(fitted_model_from(5, result).error().reason, "no_model");
  EXPECT_EQ(fitted_model_from(5, json{}).error().reason, "no_model");
}

}  // namespace
}  // namespace server::experiments
