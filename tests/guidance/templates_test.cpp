#include "core/guidance/templates.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/guidance/tiny_model.h"

namespace fieldgraft {
namespace {

TEST(Templates, EveryDefaultIsGoodAndDifferent) {
    const auto& all = default_templates();
    EXPECT_GE(all.size(), 25u);
    EXPECT_EQ(std::set(all.begin(), all.end()).size(), all.size());
    for (const std::string& text : all) EXPECT_NO_THROW(check_template(text, "default"));
    EXPECT_EQ(all.front(), "{}");
}

TEST(Templates, ChoicesAreDifferentAndRepeatable) {
    Random first(4), again(4);
    const auto chosen = choose_templates(default_templates(), first, 8);
    EXPECT_EQ(chosen, choose_templates(default_templates(), again, 8));
    EXPECT_EQ(std::set(chosen.begin(), chosen.end()).size(), 8u);
    EXPECT_NE(chosen, choose_templates(default_templates(), first, 8));
    EXPECT_EQ(choose_templates(default_templates(), first, 1000).size(), default_templates().size());
    EXPECT_THROW(choose_templates(default_templates(), first, 0), std::invalid_argument);
    EXPECT_THROW(choose_templates({}, first, 1), std::invalid_argument);
}

TEST(Templates, ThePromptIsPutIn) {
    EXPECT_EQ(fill_template("a photo of {}!", "red {ball}"), "a photo of red {ball}!");
    const std::vector<std::string> two{"{}", "one {} two"};
    EXPECT_EQ(expand("x", two), (std::vector<std::string>{"x", "one x two"}));
    Random random(1);
    EXPECT_EQ(expand("x", two, random, 1).size(), 1u);
    EXPECT_NE(message_of<InputError>([] {
                  check_template("no place", "config.json");
              }).find("config.json: the template 'no place'"),
              std::string::npos);
    EXPECT_THROW(check_template("{} and {}", ""), InputError);
}

}  // namespace
}  // namespace fieldgraft
