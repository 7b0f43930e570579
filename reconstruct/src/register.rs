//! Registration of clouds: the stages of the source document and the better choices.
