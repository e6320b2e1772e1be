//! A file that is no library, in a process of its own: the first library of a process stays.

use learn::runtime::{Runtime, RuntimeError};

#[test]
fn a_file_that_is_no_library_is_an_error_each_time() {
    let file = std::env::temp_dir().join(format!("not-onnxruntime-{}.so", std::process::id()));
    std::fs::write(&file, "no library").unwrap();
    for _ in 0..2 {
        let refused = Runtime::load_from(&file);
        assert!(matches!(refused, Err(RuntimeError::Library { .. })));
    }
    std::fs::remove_file(&file).unwrap();
}
