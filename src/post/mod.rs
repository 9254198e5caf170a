//! From a toolpath to the text of a program, by the word tables of posts/.
