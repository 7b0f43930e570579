//! The table of listings: one's own, or all for an admin.

use axum::Json as Answer;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

use super::products::{empty_as_none, paging};
use crate::auth::Caller;
use crate::db::product::{Order, ProductFilter};
use crate::error::{Problem, Result};
use crate::extract::Query;
use crate::model::{Scope, Status};
use crate::state::App;
use crate::views::ManagedCard;

#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub(super) struct Search {
    /// Words to be found in title or description.
    q: Option<String>,
    #[serde(default, deserialize_with = "empty_as_none")]
    #[param(value_type = Option<Status>)]
    status: Option<Status>,
    page: Option<i64>,
    per_page: Option<i64>,
}

#[derive(Debug, Serialize, ToSchema)]
pub(super) struct ManagedList {
    items: Vec<ManagedCard>,
    page: i64,
    per_page: i64,
    total: i64,
}

/// Sellers see their own listings, admins all.
#[utoipa::path(get, path = "/api/manage/products", operation_id = "list_managed", tag = "products", params(Search),
    responses((status = 200, body = ManagedList), (status = 401, body = Problem)))]
pub(super) async fn list(
    State(app): State<App>,
    caller: Caller,
    Query(search): Query<Search>,
) -> Result<Answer<ManagedList>> {
    caller.require(Scope::Upload)?;
    let (page, per_page) = paging(search.page, search.per_page);
    let filter = ProductFilter {
        words: search.q,
        category: None,
        status: search.status,
        owner_id: (!caller.is_admin()).then(|| caller.account.id.clone()),
        order: Order::Newest,
        limit: per_page,
        offset: (page - 1) * per_page,
    };
    let (rows, total) = app.db.products(&filter).await?;
    Ok(Answer(ManagedList { items: rows.iter().map(ManagedCard::from).collect(), page, per_page, total }))
}
