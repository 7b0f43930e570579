//! `--method source` prints what every stage of the source's chain did, as the source's tables.

use super::support::{build, json, mug};

#[test]
fn every_stage_prints_its_counts() {
    let home = tempfile::tempdir().unwrap();
    let ran = build(mug(), home.path(), &["--method", "source"]).with_status(0);
    for column in
        ["points", "down-sampled", "key points", "matches", "RANSAC inliers", "ICP iterations", "ICP error"]
    {
        assert!(ran.out.contains(column), "{column:?} is not in\n{}", ran.out);
    }
    let chain = &json(&home.path().join("report.json"))["source_chain"];
    let pairs = chain["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 3);
    for pair in pairs {
        let count = |name: &str| pair[name].as_u64().unwrap_or_else(|| panic!("no {name} in {pair}"));
        assert!(count("points") > count("points_down_sampled"), "{pair}");
        assert!(count("points_down_sampled") > count("key_points"), "{pair}");
        assert!(
            count("key_points") >= count("matches") && count("matches") >= count("ransac_inliers"),
            "{pair}"
        );
        assert!(count("ransac_inliers") >= 3 && count("icp_iterations") >= 1, "{pair}");
        assert!((0.0..0.01).contains(&pair["icp_rmse_metres"].as_f64().unwrap()), "{pair}");
        let row = ran.out.lines().find(|line| line.starts_with(pair["view"].as_str().unwrap())).unwrap();
        for name in ["points", "matches", "ransac_inliers", "icp_iterations"] {
            assert!(row.contains(&count(name).to_string()), "{name} is not in {row:?}");
        }
    }
}
