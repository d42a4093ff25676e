// The compiled half of fmt. libtorch's headers bring a newer fmt than the system's libfmt and come first on the include
// path, so fmt's own out-of-line functions are compiled here, once, from those headers.
#include <fmt/format-inl.h>

// What the headers declare as instantiated elsewhere; only char is used.
template fmt::detail::thousands_sep_result<char> fmt::detail::thousands_sep_impl<char>(fmt::locale_ref);
template char fmt::detail::decimal_point_impl<char>(fmt::locale_ref);
