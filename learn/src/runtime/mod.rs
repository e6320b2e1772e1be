//! ONNX Runtime beside our own evaluations. Not pure: it loads a shared library.
