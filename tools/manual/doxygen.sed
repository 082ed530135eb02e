# A header of ours as Doxygen reads it: the comment that it opens with is about the file, one before a declaration about
# that, one behind a member about the member. They carry no marks of a program, and what would be one for Doxygen or
# HTML is what it looks like. (INPUT_FILTER of docs/Doxyfile: sed -E -f)
/^ *\/\/( |$)/ {
  s/[\\@<>&#$%"]/\\&/g
  s/^( *)\/\//\1\/\/\//
  1s/^\/\/\//\/\/\/ \\file\n\/\/\//
  b
}
/^\}/ b
s/^(.*[^ ]) +\/\/ (.*)/\1  \/\/\/< \2/
