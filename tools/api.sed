# For docs/Doxyfile: what heads a header is the description of the file; a comment behind a declaration ends with its
# line (Doxygen would take a comment on the next line, which belongs to what follows, for more of it); describe(), the
# same everywhere, has its comment from here; a sentence that begins with Where or Samples is not about the struct.
# Lines keep their numbers, so that warnings name those of the header.
1s,^#pragma once$,/// @file,
2,/^$/s,^//\( \|$\),///\1,
s,\(///.* \)\(Where\|Samples\) \([a-z]\),\1%\2 \3,
s,///< \(.*\)$,/**< @brief \1 */,
s,^ *template <class Self\, class Visit>$,/** @brief Tells a visitor of every number: its key in configs\, itself\, unit\, range and default\, one sentence (birefit/director.h); its body\, below\, has them. */ &,
