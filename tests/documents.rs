//! The documents: what they show is there.

use std::path::Path;

#[test]
fn pictures_and_links_of_the_documents_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut links = 0;
    for document in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/run-log.md"] {
        let text = std::fs::read_to_string(root.join(document)).expect("a document of the crate");
        assert!(!text.contains("@@"), "{document}: a figure is still missing");
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if !link.starts_with("http") && !link.starts_with('#') {
                assert!(root.join(link).exists(), "{document} names {link}");
                links += 1;
            }
        }
    }
    assert!(links > 3, "only {links} links were found: this test reads the wrong files");
}
