// The compiled half of fmt. libtorch's headers bring a newer fmt than the system's libfmt and come first on the include path,
// so fmt's own out-of-line functions are compiled here, once, from those headers.
#include <fmt/format-inl.h>
